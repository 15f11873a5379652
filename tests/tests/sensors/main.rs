//! Sensors that are bolted to their reference: encoders, resolvers, magnetometers, interferometers, rate gyroscopes. A file is
//! one promise; the files are one program, which links once what they all need.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod angle_sensors;
mod another_pass;
mod blocks_held_out;
mod magnetometers;
mod one_turn;
mod part_of_a_turn;
mod rate_gyroscope_gaps;
mod rate_gyroscope_scale;
mod rate_gyroscope_temperature;
mod rate_gyroscopes;
mod sensor_runs;
mod stations;
mod texts_of_sensors;

//! Campaigns of gyroscopes, simulated and identified. A file is one promise; the files are one program, which links once what
//! they all need.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod advice;
mod carrier_forces;
mod carrier_story;
mod channel_phase;
mod channels;
mod drive_quantisation;
mod drive_saturation;
mod effects_as_text;
mod feedthrough;
mod foreign_runs;
mod held_out;
mod hidden_causes;
mod latency;
mod outside;
mod ring_downs;
mod scale_factor;
mod temperature;
mod untold_drives;
mod without_commands;

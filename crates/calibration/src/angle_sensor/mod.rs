//! Angle sensors: two channels that read a sine and a cosine, or an angle, against a reference. Resolvers, Hall pairs,
//! encoders, magnetometers, interferometers.
mod agreement;
mod autoregression;
mod circle;
mod cross_axis;
mod cross_validation;
pub(crate) mod curve;
mod deviations;
mod effects;
mod ellipse;
mod identify;
mod jumps;
pub(crate) mod likeness;
mod lines;
pub(crate) mod model;
mod odd_runs;
mod rails;
mod rate_alone;
mod rate_deviations;
mod rate_finding;
pub(crate) mod rate_gyroscope;
mod rate_nonlinearity;
mod rate_regression;
mod rate_runs;
mod readout;
mod readout_fit;
pub(crate) mod reference_free;
mod report;
mod samples;
mod screening;
mod selection;
mod sensor;
mod sensor_alone;
mod table_fit;
mod thermal;
mod units;

pub(crate) use identify::{identify, is_rate_gyroscope, serves};

//! The commands as people meet them. A file is one visitor or one subject; the files are one program, which links once what
//! they all need.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod at_rest;
mod bad_input;
mod book;
mod commands;
#[cfg(unix)]
mod firmware;
#[cfg(unix)]
mod first_hour;
mod fleet;
mod limits;
mod line;
mod mistakes;
mod newcomer;
mod pages;
mod paper;
mod people;
mod rates;
mod sensors;
#[path = "../support/mod.rs"]
mod support;
mod units;

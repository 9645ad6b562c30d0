//! Plant and actuators for other tools: an FMU for co-simulation, FMI 3.0. `trefoil export --to fmu` packs it.
//!
//! ```text
//! modelDescription.xml       by `description`, with the variables of `variables`
//! resources/scenario.toml    merged settings; the parameter `settings` lies on top, as `--set` does
//! binaries/<platform>/       this crate as a shared library: `exports` and `absent` around an `Instance`
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`description`] | modelDescription.xml |
//! | `variables` | names, units and values of the inputs and outputs |
//! | `instance` | a plant, moved period by period |
//! | `exports` | the functions that tools call |
//! | `absent` | functions of other kinds of FMU, which return an error |
//!
//! A step is a whole number of periods. Its command arrives at the beginning of each period, as in a flight in process,
//! and takes effect after the delay of the scenario.

mod absent;
pub mod description;
mod exports;
mod instance;
mod variables;

//! State of a flying stack as `status` and the live page show it, read without joining the stack.

use contract::message::mixer_flags;
use runtime::domain::Domain;
use runtime::realtime::{ControlPage, phase as phases};
use serde_json::{Value, json};

use super::{ControlRequest, ask};
use crate::log::Record;

/// Returns the state of one stack: its settings, its control page, and the launcher's answer. Fields that cannot be
/// read are absent.
pub fn view(domain: &Domain) -> Value {
    let mut view = json!({ "namespace": domain.namespace(), "launcher_pid": domain.launcher_pid() });
    if let Ok(scenario) = domain.scenario() {
        view["name"] = json!(scenario.name);
        view["mode"] = json!(scenario.run.mode);
        view["profile"] = json!(scenario.profile);
        view["duration_s"] = json!(scenario.run.duration_s);
    }
    if let Some(phase) = phase(domain) {
        view["time_s"] = json!(time_s(domain));
        view["phase"] = json!(phase);
    }
    // Only the launcher knows the other fields, and it does not answer while it ends.
    if let (Some(view), Ok(Value::Object(told))) = (view.as_object_mut(), ask(domain, &ControlRequest::Status)) {
        view.extend(told);
    }
    view
}

/// Names the rung of the mixer's fallback ladder that gave the command of `record`; `on demand` if nothing is missing.
pub fn rung(record: &Record) -> &'static str {
    let Record::Actuators(actuators) = record else { return "?" };
    let rungs = [
        (mixer_flags::TERMINATED, "terminated"),
        (mixer_flags::DISARMED, "disarmed"),
        (mixer_flags::CUT, "thrust cut"),
        (mixer_flags::TRIM_ONLY, "trim only"),
        (mixer_flags::YAW_GIVEN_UP, "descending, yaw given up"),
        (mixer_flags::DESCENDING, "descending"),
        (mixer_flags::LEVELLED, "levelled"),
        (mixer_flags::HELD, "last demand held"),
    ];
    rungs.iter().find(|(flag, _)| actuators.flags & flag != 0).map_or("on demand", |(_, name)| name)
}

/// Returns the phase of the flight: starting, flying or ending; `None` without a control page.
pub fn phase(domain: &Domain) -> Option<&'static str> {
    let page = ControlPage::open(&domain.file("page")).ok()?;
    Some(match page.phase.count() {
        phases::JOIN => "starting",
        phases::GO => "flying",
        _ => "ending",
    })
}

/// Returns the simulated time of the flight \[s\]; `None` if control page or settings cannot be read.
pub fn time_s(domain: &Domain) -> Option<f64> {
    let page = ControlPage::open(&domain.file("page")).ok()?;
    Some(f64::from(page.watched.count()) / f64::from(domain.scenario().ok()?.run.rate_hz))
}

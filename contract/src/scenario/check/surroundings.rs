//! Faults of what a flight flies in: clock, host, and processes that do not belong to it.

use super::Found;
use super::faults::word;
use crate::scenario::{Fault, FaultKind, FaultTarget, Mode};

/// Whether `fault` names a process where it needs one, and can happen at all in this mode.
pub fn check(fault: &Fault, mode: Mode, found: &mut Found) {
    let of_one = matches!(fault.kind, FaultKind::Offset | FaultKind::ShmRemoved);
    let named = fault.process.is_some_and(|target| target.process().is_some());
    found.require(
        fault.process.is_some() == of_one && (named || !of_one),
        &["fault"],
        if of_one {
            format!("{} without the name of a process that has it", word(fault.kind))
        } else {
            format!("{} with a `process`", word(fault.kind))
        },
        "`process` = \"plant\", \"guidance\", \"attitude-mpc\" or \"mixer\" with offset and shm-removed, and with no other",
    );
    let needs_processes = of_one || fault.kind.is_intrusion();
    found.require(
        !needs_processes || mode != Mode::Inprocess || !fault.target.kinds().contains(&fault.kind),
        &["fault", "run.mode"],
        format!("{} where one thread flies, without clock and shared memory", word(fault.kind)),
        "`run.mode` = \"realtime\" or \"lockstep\"",
    );
    found.require(
        fault.target != FaultTarget::Host || fault.for_s.is_none(),
        &["fault"],
        format!("{} with an end", word(fault.kind)),
        "no `for_s`: a log that has failed once is closed, and a name that is gone does not come back",
    );
}

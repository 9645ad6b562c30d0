//! The CPU that the nodes of a flight in lockstep share.
//!
//! Their ring is strictly sequential, so a second CPU has nothing to do in it, and a wake-up across CPUs takes several
//! times as long as one on the same CPU. Flights side by side take a CPU each.
//!
//! Which are taken is told by a lock (`flock`) on the folder that the kernel shows of a CPU: every user sees the same
//! folders, nothing is left there, and the kernel drops a lock with the process that has it.

use std::fs::File;
use std::process::Child;

use rustix::fs::{FlockOperation, flock};
use rustix::process::Pid;
use rustix::thread::{CpuSet, sched_getaffinity, sched_getcpu, sched_setaffinity};

/// A CPU that no other flight in lockstep has taken, as far as there is one.
pub struct OneCpu {
    cpu: usize,
    /// Held while the flight lives; `None` where all CPUs were taken.
    _lock: Option<File>,
}

impl OneCpu {
    /// Takes a CPU of those that this thread may run on. Where other flights have them all it shares the one it is on.
    pub fn take() -> Option<Self> {
        let here = sched_getcpu();
        let free = free_cpu(&sched_getaffinity(None).ok()?, here);
        Some(free.map_or(Self { cpu: here, _lock: None }, |(cpu, lock)| Self { cpu, _lock: Some(lock) }))
    }

    /// Keeps `child`, which has just been started, and what it starts in turn on the CPU.
    pub fn confine(&self, child: &Child) {
        let mut only = CpuSet::new();
        only.set(self.cpu);
        // Fails for one that has ended already, and for one of another user: it flies as well, but slower.
        let _ = sched_setaffinity(Some(Pid::from_child(child)), &only);
    }
}

/// The first of the `allowed` CPUs that is not taken, and the lock on it: from `here` on, which the kernel found idle.
fn free_cpu(allowed: &CpuSet, here: usize) -> Option<(usize, File)> {
    let lock = |cpu: usize| {
        let folder = File::open(format!("/sys/devices/system/cpu/cpu{cpu}")).ok()?;
        let is_free = flock(&folder, FlockOperation::NonBlockingLockExclusive).is_ok();
        is_free.then_some((cpu, folder))
    };
    let cpus = (0..CpuSet::MAX_CPU).map(|i| (here + i) % CpuSet::MAX_CPU);
    cpus.filter(|cpu| allowed.is_set(*cpu)).find_map(lock)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flights_side_by_side_take_a_cpu_each_and_one_more_shares_one() {
        let allowed = sched_getaffinity(None).unwrap();
        let mut taken: Vec<_> = std::iter::from_fn(|| free_cpu(&allowed, 0)).collect(); // flights beside this test have others
        let mut cpus: Vec<usize> = taken.iter().map(|(cpu, _)| *cpu).collect();
        assert!(cpus.iter().all(|cpu| allowed.is_set(*cpu)));
        cpus.dedup();
        assert_eq!(cpus.len(), taken.len(), "none is taken twice");
        assert!(free_cpu(&allowed, 0).is_none() && OneCpu::take().is_some(), "one more has to share");
        if let Some((cpu, lock)) = taken.pop() {
            drop(lock);
            assert_eq!(free_cpu(&allowed, cpu).map(|(free, _)| free), Some(cpu), "it is free again");
        }
    }
}

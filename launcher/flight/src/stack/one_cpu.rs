//! CPU that the nodes of a flight in lockstep share.
//!
//! The ring is strictly sequential, so a second CPU would have nothing to do, and a wake-up across CPUs takes several
//! times as long as a wake-up on the same CPU. Flights side by side take a CPU each.
//!
//! A taken CPU is marked by a lock (`flock`) on its folder in `/sys`: every user sees the same folders, no file is left
//! behind, and the kernel drops a lock when the process that holds it ends.

use std::fs::File;
use std::process::Child;

use rustix::fs::{FlockOperation, flock};
use rustix::process::Pid;
use rustix::thread::{CpuSet, sched_getaffinity, sched_getcpu, sched_setaffinity};

/// CPU of a flight in lockstep; no other flight has taken it, if a CPU was free.
pub struct OneCpu {
    cpu: usize,
    /// Lock, held while the flight lives; `None` if all CPUs were taken.
    _lock: Option<File>,
}

impl OneCpu {
    /// Takes a free CPU among those that this thread may run on. If other flights have taken them all, shares the CPU
    /// on which this thread runs. `None` if the affinity of this thread cannot be read.
    pub fn take() -> Option<Self> {
        let here = sched_getcpu();
        let free = free_cpu(&sched_getaffinity(None).ok()?, here);
        Some(free.map_or(Self { cpu: here, _lock: None }, |(cpu, lock)| Self { cpu, _lock: Some(lock) }))
    }

    /// Confines `child`, which has just been started, and the processes that it starts later, to the CPU.
    pub fn confine(&self, child: &Child) {
        let mut only = CpuSet::new();
        only.set(self.cpu);
        // The call fails for a child that has ended, and for a child of another user, which then flies slower.
        let _ = sched_setaffinity(Some(Pid::from_child(child)), &only);
    }
}

/// Finds the first `allowed` CPU that is not taken, and locks it; begins at `here`, which the kernel found idle.
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
        let mut taken: Vec<_> = std::iter::from_fn(|| free_cpu(&allowed, 0)).collect(); // other flights may hold some
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

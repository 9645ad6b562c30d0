//! Tests on machines that exist only as a folder: `/proc`, `/sys` and `/dev` below a root.

use std::fs;
use std::path::Path;

use settings::{Scenario, SchedulingPolicy};

use super::*;
use crate::host::{CpuTimes, stolen};

const LIMITS: &str = "\
Limit                     Soft Limit           Hard Limit           Units     
Max file size             unlimited            unlimited            bytes     
Max data size             unlimited            unlimited            bytes     
Max stack size            8388608              unlimited            bytes     
Max open files            1024                 524288               files     
Max locked memory         8388608              8388608              bytes     
Max address space         unlimited            unlimited            bytes     
Max realtime priority     0                    0                    
";
const ROOT_CAPS: &str = "CapEff:\t000001ffffffffff\n";
const NO_CAPS: &str = "CapEff:\t0000000000000000\n";
const SYSTEM_IDS: &str = "         0          0 4294967295\n";

/// A machine whose files are written by the test.
struct Fake(tempfile::TempDir);

impl Fake {
    /// Makes a workstation: four processors, `PREEMPT_RT`, root, nothing that disturbs.
    fn good() -> Self {
        let fake = Self(tempfile::tempdir().unwrap());
        fs::create_dir_all(fake.0.path().join("dev/shm")).unwrap();
        for (path, text) in [
            ("proc/self/limits", LIMITS),
            ("proc/self/status", &format!("VmSize:\t  100000 kB\n{ROOT_CAPS}Cpus_allowed_list:\t0-3\n")),
            ("proc/self/uid_map", SYSTEM_IDS),
            ("proc/self/cgroup", "0::/user.slice\n"),
            (
                "proc/self/mountinfo",
                "31 23 0:28 / /sys/fs/cgroup rw,relatime shared:9 - cgroup2 cgroup2 rw,nsdelegate\n",
            ),
            ("sys/fs/cgroup/user.slice/cpu.max", "max 100000\n"),
            ("proc/sys/kernel/osrelease", "6.12.1-rt\n"),
            ("proc/sys/kernel/version", "#1 SMP PREEMPT_RT Debian\n"),
            ("sys/kernel/realtime", "1\n"),
            ("proc/sys/kernel/sched_rt_runtime_us", "950000\n"),
            ("proc/sys/kernel/sched_rt_period_us", "1000000\n"),
            ("proc/cpuinfo", "processor\t: 0\nflags\t\t: fpu tsc\n"),
            ("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n"),
            ("sys/devices/system/clocksource/clocksource0/available_clocksource", "tsc hpet\n"),
            ("sys/devices/system/cpu/online", "0-3\n"),
            ("sys/devices/system/cpu/isolated", "\n"),
            ("sys/devices/system/cpu/smt/active", "0\n"),
            ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n"),
            ("sys/devices/system/cpu/cpu0/cpuidle/state1/name", "C1\n"),
            ("sys/devices/system/cpu/cpu0/cpuidle/state1/latency", "2\n"),
            ("sys/devices/system/cpu/cpu0/cpuidle/state1/disable", "0\n"),
        ] {
            fake.write(path, text);
        }
        fake
    }

    fn write(&self, path: &str, text: impl AsRef<[u8]>) {
        let path = self.0.path().join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    fn remove(&self, path: &str) {
        let path = self.0.path().join(path);
        if path.is_dir() { fs::remove_dir_all(path).unwrap() } else { fs::remove_file(path).unwrap() }
    }

    fn status(&self, capabilities: &str, cpus: &str) {
        let text = format!("VmSize:\t  100000 kB\n{capabilities}Cpus_allowed_list:\t{cpus}\n");
        self.write("proc/self/status", text);
    }

    fn limit(&self, name: &str, soft: &str, hard: &str) {
        let lines = LIMITS.lines().map(|line| {
            if line.starts_with(name) { format!("{name}  {soft}  {hard}  units") } else { line.to_owned() }
        });
        self.write("proc/self/limits", lines.collect::<Vec<_>>().join("\n"));
    }

    fn machine(&self) -> Machine {
        Machine::below(self.0.path())
    }

    fn findings(&self, scenario: &Scenario) -> Vec<Finding> {
        let machine = self.machine();
        let mut found = scheduling(&machine, scenario, None, "/opt/trefoil");
        found.extend(required(&machine, scenario));
        found.extend(disturbances(&machine));
        found
    }

    /// Returns the finding of one check, for the default flight.
    fn find(&self, check: &str) -> Finding {
        let found = self.findings(&scenario());
        found.into_iter().find(|finding| finding.check == check).unwrap_or_else(|| panic!("no check {check}"))
    }

    #[track_caller]
    fn check(&self, check: &str, level: Severity, words: &[&str]) {
        let finding = self.find(check);
        assert_eq!(finding.level, level, "{finding:?}");
        for word in words {
            assert!(finding.line().contains(word), "{word}: {finding:?}");
        }
    }
}

fn scenario() -> Scenario {
    Scenario::default()
}

#[test]
fn a_good_machine_has_no_warning() {
    for finding in Fake::good().findings(&scenario()) {
        assert_eq!(finding.level, Severity::Ok, "{finding:?}");
        assert_eq!(finding.remedy, None, "{finding:?}");
    }
}

#[test]
fn a_machine_without_files_is_unknown_and_never_guessed() {
    let empty = Fake(tempfile::tempdir().unwrap());
    for finding in empty.findings(&scenario()) {
        // Two checks do not depend on a file: the scenario names no processors, and missing shared memory is bad.
        let expected = match finding.check {
            "affinity" => Severity::Ok,
            "shared memory" => Severity::Bad,
            _ => Severity::Unknown,
        };
        assert_eq!(finding.level, expected, "{finding:?}");
    }
    assert_eq!(stolen(None, None).level, Severity::Unknown);
}

#[test]
fn each_unreadable_file_leaves_its_check_unknown() {
    for (path, check) in [
        ("proc/self/uid_map", "scheduling class"),
        ("proc/self/uid_map", "memory lock"),
        ("proc/self/cgroup", "cgroup quota"),
        ("proc/sys/kernel/version", "preemption"),
        ("proc/sys/kernel/sched_rt_runtime_us", "FIFO throttling"),
        ("sys/devices/system/cpu/online", "processors"),
        ("sys/devices/system/cpu/isolated", "isolation"),
        ("sys/devices/system/cpu/smt", "hardware threads"),
        ("sys/devices/system/cpu/cpu0/cpufreq", "frequency"),
        ("sys/devices/system/cpu/cpu0/cpuidle", "idle states"),
        ("sys/devices/system/clocksource", "clock source"),
        ("proc/cpuinfo", "virtualisation"),
    ] {
        let fake = Fake::good();
        fake.remove(path);
        fake.check(check, Severity::Unknown, &[]);
    }
}

#[test]
fn privileges_come_from_capabilities_or_limits() {
    let fake = Fake::good();
    fake.status(NO_CAPS, "0-3");
    let setcap = "sudo setcap cap_sys_nice,cap_ipc_lock+ep /opt/trefoil";
    fake.check("scheduling class", Severity::Bad, &["SCHED_OTHER for want of privilege", "highest priority 0", setcap]);
    fake.check("memory lock", Severity::Bad, &["8.0 MB may be locked of", setcap]);
    fake.limit("Max realtime priority", "99", "99");
    fake.check("scheduling class", Severity::Ok, &["SCHED_FIFO"]);
    fake.check("memory lock", Severity::Bad, &["sudo setcap cap_ipc_lock+ep /opt/trefoil"]);
    let lowest = scenario().scheduling_of(0).priority.to_string();
    fake.limit("Max realtime priority", &lowest, &lowest);
    fake.check("scheduling class", Severity::Bad, &["SCHED_FIFO for 1 of 4 nodes for want of privilege"]);
    fake.limit("Max locked memory", "unlimited", "unlimited");
    fake.check("memory lock", Severity::Ok, &["locked"]);
    fake.limit("Max locked memory", "1100000000", "1100000000");
    fake.check("memory lock", Severity::Bad, &["1049.0 MB may be locked of"]);
    fake.limit("Max locked memory", "4000000000", "4000000000");
    fake.check("memory lock", Severity::Ok, &[]);
}

#[test]
fn capabilities_of_a_user_namespace_count_for_nothing() {
    let fake = Fake::good();
    fake.write("proc/self/uid_map", "         0       1000          1\n");
    fake.check("scheduling class", Severity::Bad, &[]);
    fake.check("memory lock", Severity::Bad, &[]);
}

#[test]
fn a_privilege_that_is_not_asked_for_is_not_missed() {
    let fake = Fake::good();
    fake.status(NO_CAPS, "0-3");
    let mut scenario = scenario();
    (scenario.realtime.policy, scenario.realtime.lock_memory) = (SchedulingPolicy::Other, false);
    let found = scheduling(&fake.machine(), &scenario, None, "launcher");
    assert!(found.iter().all(|finding| finding.level == Severity::Ok), "{found:?}");
    scenario = Scenario::default();
    scenario.run.mode = Mode::Lockstep;
    let found = scheduling(&fake.machine(), &scenario, None, "launcher");
    assert!(found.iter().all(|finding| finding.level == Severity::Ok), "{found:?}");
}

#[test]
fn granted_privileges_override_the_expected_ones() {
    let granted = Granted { fifo: 0, locked: 4 };
    let found = scheduling(&Fake::good().machine(), &scenario(), Some(granted), "launcher");
    assert_eq!([found[0].level, found[1].level], [Severity::Bad, Severity::Ok], "{found:?}");
}

#[test]
fn processors_that_are_not_there_are_named() {
    let fake = Fake::good();
    fake.status(ROOT_CAPS, "0,2");
    let mut scenario = scenario();
    scenario.realtime.affinity = vec![1, 2];
    let found = scheduling(&fake.machine(), &scenario, None, "launcher");
    assert_eq!(found[2].level, Severity::Bad);
    assert!(
        found[2].found.starts_with("processors 1 of the scenario") && found[2].line().contains("0, 2"),
        "{found:?}"
    );
    fake.status(ROOT_CAPS, "2");
    fake.check("processors", Severity::Warn, &["1 of 4", "cpuset"]);
    fake.write("sys/devices/system/cpu/isolated", "2-3\n");
    fake.check("isolation", Severity::Ok, &["processors 2, 3", "realtime.affinity = [2, 3]"]);
}

#[test]
fn quotas_of_both_versions_are_found_also_above_the_own_group() {
    let fake = Fake::good();
    fake.write("proc/self/cgroup", "0::/a/b\n");
    fake.write("sys/fs/cgroup/a/cpu.max", "150000 100000\n");
    fake.write("sys/fs/cgroup/a/b/cpu.max", "max 100000\n");
    fake.check("cgroup quota", Severity::Warn, &["1.50 processors", "echo max | sudo tee /sys/fs/cgroup/a/cpu.max"]);
    // Control groups of version 1, in a container that sees its own group as the top.
    fake.write("proc/self/cgroup", "4:cpu,cpuacct:/docker/7\n");
    let mount = "32 31 0:29 /docker/7 /sys/fs/cgroup/cpu ro,relatime master:11 - cgroup cgroup rw,cpu,cpuacct\n";
    fake.write("proc/self/mountinfo", mount);
    fake.write("sys/fs/cgroup/cpu/cpu.cfs_quota_us", "50000\n");
    fake.write("sys/fs/cgroup/cpu/cpu.cfs_period_us", "100000\n");
    fake.check("cgroup quota", Severity::Warn, &["0.50 processors", "/sys/fs/cgroup/cpu/cpu.cfs_quota_us", "--cpus"]);
    fake.write("sys/fs/cgroup/cpu/cpu.cfs_quota_us", "-1\n");
    fake.check("cgroup quota", Severity::Ok, &["none"]);
    fake.write("proc/self/cgroup", "4:cpu,cpuacct:/docker/7/../../else\n");
    fake.check("cgroup quota", Severity::Unknown, &[]);
}

#[test]
fn a_group_without_time_for_fifo_is_told_even_to_root() {
    let fake = Fake::good();
    fake.write("proc/self/cgroup", "1:cpu:/app\n");
    fake.write("proc/self/mountinfo", "32 31 0:29 / /sys/fs/cgroup/cpu rw - cgroup cgroup rw,cpu\n");
    fake.write("sys/fs/cgroup/cpu/app/cpu.rt_runtime_us", "0\n");
    fake.check("scheduling class", Severity::Bad, &["gives no time", "echo $$ | sudo tee /sys/fs/cgroup/cpu/tasks"]);
    fake.write("sys/fs/cgroup/cpu/app/cpu.rt_runtime_us", "950000\n");
    fake.check("scheduling class", Severity::Ok, &[]);
}

#[test]
fn preemption_models_are_told_apart() {
    let fake = Fake::good();
    fake.remove("sys/kernel/realtime");
    let version = |text: &str| fake.write("proc/sys/kernel/version", text);
    version("#1 SMP PREEMPT_DYNAMIC x");
    fake.check("preemption", Severity::Unknown, &["sudo cat /sys/kernel/debug/sched/preempt"]);
    fake.write("proc/cmdline", "quiet preempt=full\n");
    fake.check("preemption", Severity::Ok, &["dynamic, full"]);
    fake.write("sys/kernel/debug/sched/preempt", "none (voluntary) full\n");
    fake.check("preemption", Severity::Warn, &["dynamic, voluntary", "echo full | sudo tee"]);
    version("#1 SMP PREEMPT x");
    fake.check("preemption", Severity::Ok, &[]);
    version("#1 SMP x");
    fake.check("preemption", Severity::Warn, &["PREEMPT_RT"]);
}

#[test]
fn settings_of_kernel_and_processors_that_disturb_are_told_with_their_command() {
    let fake = Fake::good();
    fake.write("proc/sys/kernel/sched_rt_runtime_us", "-1\n");
    fake.check("FIFO throttling", Severity::Warn, &["off", "kernel.sched_rt_runtime_us=950000"]);
    fake.write("proc/sys/kernel/sched_rt_runtime_us", "100000\n");
    fake.check("FIFO throttling", Severity::Warn, &["100 of every 1000 ms"]);
    fake.write("sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet\n");
    fake.check("clock source", Severity::Warn, &["hpet", "echo tsc | sudo tee"]);
    fake.write("sys/devices/system/cpu/smt/active", "1\n");
    fake.check("hardware threads", Severity::Warn, &["smt/control"]);
    fake.write("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "schedutil\n");
    fake.check("frequency", Severity::Warn, &["performance, schedutil", "scaling_governor"]);
    fake.write("proc/cpuinfo", "flags : fpu hypervisor\n");
    fake.write("sys/class/dmi/id/sys_vendor", "QEMU\n");
    fake.check("virtualisation", Severity::Warn, &["QEMU"]);
    fake.write("proc/cpuinfo", "BogoMIPS : 50\n");
    fake.check("virtualisation", Severity::Unknown, &[]);
}

#[test]
fn deep_idle_states_are_told_unless_they_are_off() {
    let fake = Fake::good();
    let state = |number: u32, name: &str, exit_us: u32, disable: u32| {
        let folder = format!("sys/devices/system/cpu/cpu0/cpuidle/state{number}");
        for (file, text) in
            [("name", name.to_owned()), ("latency", exit_us.to_string()), ("disable", disable.to_string())]
        {
            fake.write(&format!("{folder}/{file}"), text);
        }
    };
    state(2, "C6", 133, 0);
    state(3, "C8", 400, 0);
    fake.check("idle states", Severity::Warn, &["C8, left within 400 us", "cpuidle/state{2,3}/disable"]);
    fake.write("dev/cpu_dma_latency", 200_i32.to_le_bytes());
    fake.check("idle states", Severity::Warn, &["C6", "cpuidle/state2/disable"]);
    fake.write("dev/cpu_dma_latency", 10_i32.to_le_bytes());
    fake.check("idle states", Severity::Ok, &["C1"]);
    fake.remove("dev/cpu_dma_latency");
    state(2, "C6", 133, 1);
    state(3, "C8", 400, 1);
    fake.check("idle states", Severity::Ok, &["C1"]);
}

#[test]
fn limits_that_keep_a_flight_from_beginning_are_bad() {
    let fake = Fake::good();
    fake.limit("Max open files", "64", "64");
    fake.check("open files", Severity::Bad, &["64 files", "a flight needs 128; raise the limit (`ulimit -Hn`)"]);
    fake.limit("Max open files", "64", "unlimited");
    fake.check("open files", Severity::Ok, &[]);
    for (name, raise) in
        [("Max stack size", "ulimit -s"), ("Max data size", "ulimit -d"), ("Max address space", "ulimit -v")]
    {
        fake.limit(name, "262144", "unlimited");
        fake.check("limits on memory", Severity::Bad, &["256 kB", raise]);
    }
    fake.limit("Max file size", "1000", "1000");
    fake.check("file size", Severity::Bad, &["1000 bytes", "ulimit -f"]);
    fake.remove("dev/shm");
    fake.check("shared memory", Severity::Bad, &["mount -t tmpfs"]);
}

#[test]
fn stolen_time_is_a_share_of_the_time_between_two_readings() {
    let fake = Fake::good();
    let read = |steal: u64, idle: u64| {
        fake.write("proc/stat", format!("cpu  10 0 10 {idle} 0 0 0 {steal} 500 0\ncpu0 1 1 1 1 1 1 1 1 1 1\n"));
        CpuTimes::read(&fake.machine())
    };
    let before = read(5, 100);
    assert_eq!(stolen(before, read(5, 300)).level, Severity::Ok);
    let finding = stolen(before, read(25, 280));
    assert_eq!((finding.level, finding.found.as_str()), (Severity::Warn, "10.00 % during this check"));
    fake.write("proc/stat", "cpu  10 0 10\n");
    assert_eq!(CpuTimes::read(&fake.machine()), None, "a kernel without the field");
}

#[test]
fn this_machine_is_read_without_a_panic() {
    assert!(Path::new("/proc/self/limits").exists());
    let machine = Machine::this();
    assert!(!disturbances(&machine).is_empty());
    assert_eq!(resources::memory(&machine).level, Severity::Ok);
}

//! Limits of control groups on processor time: quota, and time of `SCHED_FIFO`.
//!
//! The kernel lists the groups of this process in `/proc/self/cgroup`, and the folders that show them in
//! `/proc/self/mountinfo`. A container may see only a part of the tree: limits of groups above that part cannot be
//! read.

use std::path::{Component, Path, PathBuf};

use crate::finding::{Finding, Severity};
use crate::sources::Machine;

/// Folders of the group of this process for processor time: the group first, then those above it.
struct Group {
    folders: Vec<PathBuf>,
    is_v2: bool,
}

/// Checks whether a quota can stop the processes of a flight that are not in `SCHED_FIFO`.
pub(crate) fn quota(machine: &Machine) -> Option<Finding> {
    let groups = groups(machine)?;
    let all = groups.iter().flat_map(|group| group.folders.iter().map(|folder| (folder, group.is_v2)));
    let quotas = all.filter_map(|(folder, is_v2)| Some((quota_of(machine, folder, is_v2)?, folder, is_v2)));
    Some(match quotas.min_by(|(a, ..), (b, ..)| a.total_cmp(b)) {
        Some((cpus, folder, is_v2)) => {
            let folder = folder.display();
            let lift =
                if is_v2 { "echo max | sudo tee /{}/cpu.max" } else { "echo -1 | sudo tee /{}/cpu.cfs_quota_us" };
            Finding::new(
                Severity::Warn,
                format!("{cpus:.2} processors, by /{folder}"),
                "processes that are not in SCHED_FIFO stop for the rest of a period once they have used it up",
            )
            .remedy(lift.replace("{}", &folder.to_string()) + " (Docker: without --cpus)")
        }
        None => Finding::new(Severity::Ok, "none", ""),
    })
}

/// Returns the remedy if the group of this process gives no time to `SCHED_FIFO`; `None` if it gives some, or if its
/// file cannot be read.
pub(crate) fn without_fifo(machine: &Machine) -> Option<String> {
    let group = groups(machine)?.into_iter().find(|group| !group.is_v2)?;
    let time_us = machine.number(group.folders.first()?.join("cpu.rt_runtime_us"))?;
    let root = group.folders.last()?.display();
    (time_us == 0).then(|| format!("echo $$ | sudo tee /{root}/tasks (Docker: --cpu-rt-runtime)"))
}

/// Returns the number of processors whose time the group of a `folder` may use; `None` without a limit.
fn quota_of(machine: &Machine, folder: &Path, is_v2: bool) -> Option<f64> {
    let [quota_us, period_us] = if is_v2 {
        let text = machine.text(folder.join("cpu.max"))?;
        let (quota, period) = text.split_once(' ')?;
        [quota.parse().ok()?, period.parse().ok()?] // `max` is no number
    } else {
        ["cpu.cfs_quota_us", "cpu.cfs_period_us"].map(|file| machine.number(folder.join(file)).unwrap_or(-1))
    };
    (quota_us > 0 && period_us > 0).then(|| quota_us as f64 / period_us as f64)
}

/// Finds the groups of this process that can limit processor time; `None` if the files cannot be read or do not match.
fn groups(machine: &Machine) -> Option<Vec<Group>> {
    let own = machine.text("proc/self/cgroup")?;
    let mounts = machine.text("proc/self/mountinfo")?;
    let mut found = vec![];
    // A line is `number:controllers:path`, without controllers in version 2.
    for line in own.lines() {
        let mut fields = line.splitn(3, ':').skip(1);
        let (controllers, path) = (fields.next()?, fields.next()?);
        let is_v2 = controllers.is_empty();
        if is_v2 || controllers.split(',').any(|name| name == "cpu") {
            let mount = mounts.lines().find_map(|line| mount_of(line, is_v2));
            let Some((root, point)) = mount else { continue }; // a hierarchy that is not mounted has no folder to read
            let below = Path::new(path).strip_prefix(root).ok()?;
            if below.components().any(|part| part == Component::ParentDir) {
                return None; // the group lies outside the part that is visible here
            }
            let top = Path::new(point).strip_prefix("/").ok()?;
            let depth = below.components().count();
            let own: PathBuf = top.join(below).components().collect(); // removes a slash at the end
            let folders = own.ancestors().take(depth + 1).map(Path::to_owned).collect();
            found.push(Group { folders, is_v2 });
        }
    }
    Some(found)
}

/// Returns root and mount point of a line of mountinfo that mounts the groups for processor time.
fn mount_of(line: &str, is_v2: bool) -> Option<(&str, &str)> {
    let (mount, system) = line.split_once(" - ")?;
    let mut mount = mount.split(' ').skip(3);
    let mut system = system.split(' ');
    let kind = system.next()?;
    let options = system.nth(1)?;
    let is_it =
        if is_v2 { kind == "cgroup2" } else { kind == "cgroup" && options.split(',').any(|name| name == "cpu") };
    is_it.then_some((mount.next()?, mount.next()?))
}

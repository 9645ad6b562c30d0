//! cyclictest, the tool everybody knows, as the reference for a bare loop.

use std::process::{Command, Stdio};

use anyhow::Context;

/// Its name.
pub const PROGRAM: &str = "cyclictest";

/// How late each of `loops` wake-ups was, one a millisecond on `cpu` with `priority` \[ns\].
///
/// It leaves the system as it is: the loop it is compared with does not change power management either.
pub fn run(cpu: usize, priority: u32, loops: usize) -> anyhow::Result<Vec<u64>> {
    let (cpu, priority, loops) = (cpu.to_string(), priority.to_string(), loops.to_string());
    let output = Command::new(PROGRAM)
        .args(["--verbose", "--nsecs", "--mlockall", "--default-system", "--interval", "1000", "--distance", "0"])
        .args(["--affinity", &cpu, "--priority", &priority, "--loops", &loops])
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output()
        .context("cannot start cyclictest")?;
    Ok(parse(&String::from_utf8_lossy(&output.stdout)))
}

/// Lines of thread, loop and latency; everything else is talk.
fn parse(text: &str) -> Vec<u64> {
    let latency = |line: &str| -> Option<u64> {
        let mut fields = line.split(':').map(|field| field.trim().parse::<u64>().ok());
        let (_, _, latency) = (fields.next()??, fields.next()??, fields.next()??);
        fields.next().is_none().then_some(latency)
    };
    text.lines().filter_map(latency).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn latencies_are_told_from_talk() {
        let text = "Max CPUs = 2\nThread 0 Interval: 1000\n       0:       0:   12873\n       0:       1:   14720\n";
        assert_eq!(parse(text), [12_873, 14_720]);
    }
}

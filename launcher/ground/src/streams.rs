//! Rates at which messages are sent, by the wall clock: the defaults of PX4 for a telemetry link (its mode `normal`).

use std::time::{Duration, Instant};

use mavlink::MessageData;
#[allow(clippy::wildcard_imports, reason = "the dialect's own names, all in capitals")]
use mavlink::dialects::common::*;

/// Messages and their default rates \[Hz\].
const RATES_HZ: [(u32, f64); 9] = [
    (HEARTBEAT_DATA::ID, 1.0),
    (ATTITUDE_DATA::ID, 15.0),
    (LOCAL_POSITION_NED_DATA::ID, 1.0),
    (GLOBAL_POSITION_INT_DATA::ID, 5.0),
    (POSITION_TARGET_LOCAL_NED_DATA::ID, 1.5),
    (ATTITUDE_TARGET_DATA::ID, 2.0),
    (SERVO_OUTPUT_RAW_DATA::ID, 1.0),
    (EXTENDED_SYS_STATE_DATA::ID, 1.0),
    (HOME_POSITION_DATA::ID, 0.5),
];
/// Highest rate that a station can ask for \[Hz\].
const MAX_HZ: f64 = 100.0;

/// Messages that are sent without a request.
pub struct Streams(Vec<Stream>);

struct Stream {
    id: u32,
    /// Interval between two messages; `None` if they are not sent.
    period: Option<Duration>,
    due: Instant,
}

impl Streams {
    /// Returns the streams at their default rates; each is due `now`.
    pub fn new(now: Instant) -> Self {
        let stream = |(id, rate_hz): (u32, f64)| Stream { id, period: Some(period(rate_hz)), due: now };
        Self(RATES_HZ.map(stream).into())
    }

    /// Returns the messages to send at `now`. A message that was missed is not sent later.
    pub fn due(&mut self, now: Instant) -> Vec<u32> {
        let mut ids = vec![];
        for stream in &mut self.0 {
            if let Some(period) = stream.period.filter(|_| stream.due <= now) {
                ids.push(stream.id);
                stream.due = (stream.due + period).max(now);
            }
        }
        ids
    }

    /// Sets the interval of a message \[us\] as `MAV_CMD_SET_MESSAGE_INTERVAL` defines it: 0 is the default, a negative
    /// number stops the message. Returns `false` if there is no such stream, and for the heartbeat, which keeps its
    /// rate: without heartbeats a station takes the vehicle as lost.
    pub fn set(&mut self, id: u32, interval_us: f32, now: Instant) -> bool {
        let Some(stream) = self.0.iter_mut().find(|stream| stream.id == id && id != HEARTBEAT_DATA::ID) else {
            return false;
        };
        let usual = RATES_HZ.iter().find(|(of, _)| *of == id).map(|(_, rate_hz)| period(*rate_hz));
        stream.period = match f64::from(interval_us) {
            off if off < 0.0 => None,
            us if us > 0.0 => Some(Duration::from_secs_f64((us * 1e-6).clamp(1.0 / MAX_HZ, 3600.0))),
            _ => usual, // 0, or NaN
        };
        stream.due = now;
        true
    }
}

fn period(rate_hz: f64) -> Duration {
    Duration::from_secs_f64(1.0 / rate_hz)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts the messages `id` in two seconds from `now` on.
    fn count(streams: &mut Streams, id: u32, now: Instant) -> usize {
        let looks = (0..2000).map(|ms| now + Duration::from_millis(ms));
        looks.map(|look| streams.due(look).iter().filter(|due| **due == id).count()).sum()
    }

    #[test]
    fn each_message_keeps_its_rate() {
        let now = Instant::now();
        for (id, expected) in [(HEARTBEAT_DATA::ID, 2), (ATTITUDE_DATA::ID, 30), (HOME_POSITION_DATA::ID, 1)] {
            assert_eq!(count(&mut Streams::new(now), id, now), expected);
        }
    }

    #[test]
    fn a_station_can_change_a_rate_but_not_that_of_the_heartbeat() {
        let now = Instant::now();
        let mut streams = Streams::new(now);
        let mut set = |id, interval_us| {
            let is_set = streams.set(id, interval_us, now);
            (is_set, count(&mut streams, id, now))
        };
        assert_eq!(set(ATTITUDE_DATA::ID, 100_000.0), (true, 20));
        assert_eq!(set(ATTITUDE_DATA::ID, 1.0), (true, 200), "not above the limit");
        assert_eq!(set(ATTITUDE_DATA::ID, -1.0), (true, 0));
        assert_eq!(set(ATTITUDE_DATA::ID, 0.0), (true, 30));
        assert!(!set(HEARTBEAT_DATA::ID, -1.0).0);
        assert!(!set(12345, 1000.0).0);
    }
}

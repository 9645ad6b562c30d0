//! Flies a scenario in one thread and prints its state hash, as the JSON of `trefoil fly` does: `state_hash fly FILE`.
//! `.ci/processors` builds this example for an emulated processor, where the whole program would take ten minutes.

use std::error::Error;
use std::path::Path;

use contract::topic::Topic;
use plant::tricopter::Tricopter;
use ring::count::Count;
use ring::nodes;
use ring::record::Record;
use ring::samples::Samples;
use ring::states::StateHash;
use ring::stepped::Stepped;

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(2).ok_or("usage: state_hash fly SCENARIO")?;
    let scenario = settings::load(Some(Path::new(&file)), &["run.mode=inprocess".to_owned()])?;
    let (mut count, mut samples, mut hash) = (Count::default(), Samples::default(), StateHash::default());
    let watch = |record: &Record| {
        if let Some(sample) = count.gap(record).and_then(|_| samples.join(record)) {
            hash.observe(&sample);
        }
        true
    };
    let vehicle = Box::new(Tricopter::new(&scenario));
    Stepped::new(&scenario, vehicle, true, [nodes::open; Topic::OF_CONTROLLERS.len()])?.fly(watch, |_| {})?;
    std::io::Write::write_all(&mut std::io::stdout(), format!("{{\"state_hash\":\"{}\"}}\n", hash.text()).as_bytes())?;
    Ok(())
}

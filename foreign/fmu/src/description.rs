//! modelDescription.xml of an FMU.

use std::fmt::Write;

use contract::message::Sample;
use plant::vehicle::start;
use settings::{ProgramKind, Scenario};

use crate::variables::{FIRST_OUTPUT, OUTPUTS, ROTOR_SPEED, ROTOR_UNIT, SETTINGS, TILT, TIME};

/// Name of the model, and of its library without the file's extension.
pub const MODEL: &str = "trefoil_plant";
/// Token which shows that description and library belong together.
pub const TOKEN: &str = concat!("trefoil-plant-", env!("CARGO_PKG_VERSION"));
/// File of the settings, among the resources.
pub const SCENARIO_FILE: &str = "scenario.toml";

/// Checks that `scenario` has the launcher's own plant, which is the one in the FMU.
///
/// # Errors
/// The plant is a library or program.
pub fn check(scenario: &Scenario) -> Result<(), String> {
    match scenario.node.plant.kind() {
        ProgramKind::Own => Ok(()),
        _ => {
            Err(format!("an FMU has the launcher's own plant, not `{}`: remove `node.plant`", scenario.node.plant.exec))
        }
    }
}

/// Returns the description of the plant of `scenario`, with the date of the program if it is known: today's date would
/// change the bytes of the same plant.
pub fn model_description(scenario: &Scenario, date: Option<&str>) -> String {
    let (_, trim) = start(scenario);
    let [sample_s, duration_s] = [scenario.sample_s(), scenario.run.duration_s];
    let name = escaped(&scenario.name);
    let date = date.map_or(String::new(), |date| format!("\n    generationDateAndTime=\"{date}\""));
    let [one, two, three] = trim.rotor_speed;
    let tilt = trim.tilt_rad;
    let mut variables = String::new();
    let mut structure = String::new();
    for (reference, output) in (FIRST_OUTPUT..).zip(&OUTPUTS) {
        let is_vector = (output.values)(&Sample::default()).len() > 1;
        let head = format!("name=\"{}\" valueReference=\"{reference}\" causality=\"output\"", output.name);
        let rest = format!("description=\"{}\" unit=\"{}\" initial=\"calculated\"", output.about, output.unit);
        let dimension = if is_vector { "><Dimension start=\"3\"/></Float64>" } else { "/>" };
        let _ = writeln!(variables, "    <Float64 {head} {rest}{dimension}"); // writing to a string does not fail
        let _ = writeln!(structure, "    <Output valueReference=\"{reference}\"/>");
    }
    let unknowns = structure.replace("<Output ", "<InitialUnknown ");
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Trefoil plant: {name}" instantiationToken="{TOKEN}"
    description="Tilt-rotor tricopter with actuators and sensors" generationTool="Trefoil launcher"{date}>
  <CoSimulation modelIdentifier="{MODEL}" canGetAndSetFMUState="true" canSerializeFMUState="true"
      canHandleVariableCommunicationStepSize="false" fixedInternalStepSize="{sample_s:?}"/>
  <UnitDefinitions>
    <Unit name="m"/>
    <Unit name="m/s"/>
    <Unit name="rad"/>
    <Unit name="rad/s"/>
    <Unit name="{ROTOR_UNIT}"/>
  </UnitDefinitions>
  <DefaultExperiment startTime="0" stopTime="{duration_s:?}" stepSize="{sample_s:?}"/>
  <ModelVariables>
    <Float64 name="time" valueReference="{TIME}" causality="independent" variability="continuous"/>
    <String name="settings" valueReference="{SETTINGS}" causality="parameter" variability="fixed"
        description="settings on top of resources/{SCENARIO_FILE}: one KEY=VALUE a line, as trefoil fly --set takes it">
      <Start value=""/>
    </String>
    <Float64 name="rotor_speed" valueReference="{ROTOR_SPEED}" causality="input" unit="{ROTOR_UNIT}"
        description="commanded rotor speeds" start="{one:?} {two:?} {three:?}"><Dimension start="3"/></Float64>
    <Float64 name="tilt_rad" valueReference="{TILT}" causality="input" unit="rad"
        description="commanded tilt of rotor 1" start="{tilt:?}"/>
{variables}  </ModelVariables>
  <ModelStructure>
{structure}{unknowns}  </ModelStructure>
</fmiModelDescription>
"#
    )
}

/// Escapes text for an attribute.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

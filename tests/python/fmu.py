"""Checks an exported FMU with fmpy, flies it with the commands of a flight log, and compares the states.

    pip install fmpy mcap mcap-protobuf-support
    python3 fmu.py trefoil.fmu flight.mcap

Prints one line of JSON. Exit code 1 with a message on stderr when something differs.
"""

import ctypes
import json
import sys

from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

KINEMATICS = ("position_m", "velocity_mps", "attitude_rad", "rates_radps")


def vector(part, name):
    """Returns the three numbers of a field that is itself a message."""
    value = getattr(part, name)
    return [getattr(value, field.name) for field in value.DESCRIPTOR.fields]


def expected(state, truth):
    """Returns the outputs of the plant in the log."""
    outputs = {name: vector(truth.actual, name) for name in KINEMATICS}
    outputs |= {f"measured_{name}": vector(state.measured, name) for name in KINEMATICS}
    outputs["actuator_rotor_speed"] = vector(truth.actuators, "rotor_speed")
    outputs["actuator_tilt_rad"] = [truth.actuators.tilt_rad]
    return outputs


def main(fmu, log):
    problems = validate_fmu(fmu)
    if problems:
        sys.exit(f"the validator found: {problems}")
    states, truths, commands = {}, {}, {}
    with open(log, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages(topics=["/state", "/actuators", "/truth"]):
            if channel.topic == "/truth":
                truths[message.tick] = message
            else:
                (states if channel.topic == "/state" else commands)[message.stamp.tick] = message
    description = read_model_description(fmu)
    step_s = float(description.defaultExperiment.stepSize)
    variables = {variable.name: variable for variable in description.modelVariables}
    folder = extract(fmu)
    instance = FMU3Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="plant",
    )

    def get(name):
        count = 3 if variables[name].dimensions else 1
        return list(instance.getFloat64([variables[name].valueReference], nValues=count))

    def command(tick):
        rotor_speed, tilt_rad = variables["rotor_speed"].valueReference, variables["tilt_rad"].valueReference
        sent = commands[tick].command
        instance.setFloat64([rotor_speed, tilt_rad], [*vector(sent, "rotor_speed"), sent.tilt_rad])

    def check(tick):
        for name, values in expected(states[tick], truths[tick]).items():
            if get(name) != values:
                sys.exit(f"tick {tick}: {name} is {get(name)} in the FMU and {values} in the log")

    def step(tick):
        command(tick)
        instance.doStep(currentCommunicationPoint=tick * step_s, communicationStepSize=step_s)

    last, middle = max(states), max(states) // 2
    instance.instantiate()
    for settings in ("run.seed=77", ""):
        instance.setString([variables["settings"].valueReference], [settings])
        if instance.getString([variables["settings"].valueReference]) != [settings]:
            sys.exit("the parameter `settings` is not kept")
        instance.enterInitializationMode()
        instance.exitInitializationMode()
        if settings:
            noisy = get("measured_position_m")
            instance.reset()
    check(0)
    if noisy == get("measured_position_m"):
        sys.exit("the parameter `settings` has no effect")
    for tick in range(last):
        if tick == middle:
            state = instance.getFMUState()
            stored = instance.serializeFMUState(state)
        step(tick)
        check(tick + 1)
    for again in (state, instance.deserializeFMUState(stored)):
        instance.setFMUState(again)
        for tick in range(middle, last):
            check(tick)
            step(tick)
        instance.freeFMUState(again)
    instance.terminate()
    refused = 0
    for point, size in ((last * step_s, 0.6 * step_s), ((last + 7) * step_s, step_s)):
        try:
            instance.doStep(currentCommunicationPoint=point, communicationStepSize=size)
        except Exception:  # each FMI version has its own exception in fmpy
            refused += 1
    instance.freeInstance()
    print(json.dumps({"states": last + 1, "outputs": len(expected(states[0], truths[0])), "refused": refused}))


if __name__ == "__main__":
    main(*sys.argv[1:])

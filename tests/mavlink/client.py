"""A ground station: prints its port, sends requests, listens until the vehicle is disarmed, prints the messages."""

import json
import sys
import time

from pymavlink import mavutil

link = mavutil.mavlink_connection("udpin:127.0.0.1:0", source_system=255, source_component=190, dialect="common")
print(link.port.getsockname()[1], flush=True)

ATTITUDE, AUTOPILOT_VERSION, HOME_POSITION, CAMERA_INFORMATION = 30, 148, 242, 259
REQUEST, SET_INTERVAL, ARM = 512, 511, 400
came = []
begun = 0.0
asked = False
deadline = time.monotonic() + 90
while time.monotonic() < deadline:
    message = link.recv_match(blocking=True, timeout=1)
    if message is None or message.get_srcSystem() == 255:
        continue
    kind = message.get_type()
    came.append({"at": time.monotonic(), **message.to_dict()})
    if kind != "HEARTBEAT":
        continue
    armed = message.base_mode & mavutil.mavlink.MAV_MODE_FLAG_SAFETY_ARMED != 0
    begun = begun or (armed and time.monotonic())
    if begun and not armed:
        break  # the flight is over
    if begun and not asked:
        asked = True
        mav = link.mav

        def command(number, first=0, second=0, system=1):
            mav.command_long_send(system, 1, number, 0, first, second, 0, 0, 0, 0, 0)

        mav.param_request_list_send(1, 1)
        mav.param_request_read_send(1, 1, b"MPC_NP_S", -1)
        mav.param_set_send(1, 1, b"MPC_NP_S", 99.0, mavutil.mavlink.MAV_PARAM_TYPE_REAL32)
        command(REQUEST, AUTOPILOT_VERSION)
        command(REQUEST, CAMERA_INFORMATION)
        command(ARM, 0)
        command(SET_INTERVAL, ATTITUDE, 20_000)
        command(REQUEST, HOME_POSITION, system=7)  # to another vehicle
        mav.param_request_read_send(1, 1, b"SYSID_THISMAV", -1)
        mav.param_set_send(1, 1, b"SYSID_THISMAV", 2.0, mavutil.mavlink.MAV_PARAM_TYPE_REAL32)
        mav.mission_request_list_send(1, 1, 0)
        mav.mission_request_int_send(1, 1, 0, 0)
        mav.mission_count_send(1, 1, 3, 0)
        mav.mission_clear_all_send(1, 1, 255)
        link.write(b"no MAVLink")
json.dump(came, sys.stdout, default=str)

"""Trefoil from Python.

========================  ==========================================================================
:class:`Node`             process of the ring: this program answers to samples, in real time too
:func:`fly_plant`         process that is the plant: this program is the vehicle
:class:`Flight`           closed loop in this process, stepped by its iteration
:func:`fly`               flight by the launcher, in any mode
:func:`read`              log, events, timing and metrics of a run as pandas frames (extra ``read``)
:func:`campaign`          many flights by the launcher: one row each (extra ``read``)
:mod:`trefoil.gym`        Gymnasium environment on :class:`Flight` (extra ``gym``)
:mod:`trefoil.speed`      steps per second of :class:`Flight`: ``python -m trefoil.speed``
========================  ==========================================================================

SI units and radians; north-east-down for the world, forward-right-down for the body. Rotor speeds have the unit of the
paper.
"""

from ._campaign import campaign
from ._flight import Flight
from ._fly import Run, fly
from ._inputs import Demand, Reference, Sample
from ._native import Error, Setup
from ._node import Node
from ._plant import Vehicle, fly_plant
from ._read import Log, read

__all__ = [
    "Demand",
    "Error",
    "Flight",
    "Log",
    "Node",
    "Reference",
    "Run",
    "Sample",
    "Setup",
    "Vehicle",
    "campaign",
    "fly",
    "fly_plant",
    "read",
]

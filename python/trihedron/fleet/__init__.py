"""FLEET: many logs of many devices, each calibrated and diagnosed, spread over workers; one table and one page."""

from trihedron.fleet.logs import Job, find_jobs
from trihedron.fleet.running import fleet
from trihedron.fleet.summary import summarise

__all__ = ["Job", "find_jobs", "fleet", "summarise"]

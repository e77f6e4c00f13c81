"""Fleet: many logs of many devices, calibrated and diagnosed by parallel workers; one table and one page."""

from trihedron.fleet.logs import Job, find_jobs
from trihedron.fleet.running import fleet
from trihedron.fleet.summary import summarise

__all__ = ["Job", "find_jobs", "fleet", "summarise"]

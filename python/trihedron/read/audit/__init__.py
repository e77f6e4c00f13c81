"""The audit of every log: what is wrong with its clock and with its readings, each with place and number."""

from trihedron.read.audit.readings import audit_readings
from trihedron.read.audit.steps import audit_steps
from trihedron.read.audit.timing import audit_counter, audit_timing

__all__ = ["audit_counter", "audit_readings", "audit_steps", "audit_timing"]

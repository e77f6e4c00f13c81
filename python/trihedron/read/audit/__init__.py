"""The audit of every log: what is wrong with its clock and with its readings, each with place and number."""

"""The audit of every log: findings on its clock and its readings, each with place and number."""

"""Which effects the recording demands: scored, compared, accepted one at a time, judged again at the end."""

"""Sessions at a desk, from a generator of its own: nothing of trihedron.simulate, no formula of the tool.

A joint-by-joint arm, tripod heads, lazy susans and boxes tipped over their edges; parts with decimation filters;
loggers with late, bursting, wrapping or missing stamps; logs in eight layouts.
"""

"""Questions that single runs answer, each with a motion made for it."""

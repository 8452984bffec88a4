"""A learned model as an env, one dream or thousands: setting, step, rewards, ends, and what is shown of them."""

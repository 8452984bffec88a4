"""What dreaming is worth: courses of learning, with a model to dream in and without one."""

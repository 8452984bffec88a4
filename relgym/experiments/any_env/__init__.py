"""Other people's envs, through views: classic control, LunarLander, Pong and traffic from recordings, long lives."""

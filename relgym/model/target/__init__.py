"""One property of one type: its modes at work, roles, walls, spreads, and what stands in where no mode is used."""

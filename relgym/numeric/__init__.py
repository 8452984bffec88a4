"""Arrays only: regression, consensus search and decision trees; knows nothing of scenes or symbols."""

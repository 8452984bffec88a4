"""What learners see of scenes: relations, rows, situations; and what they are better not shown."""

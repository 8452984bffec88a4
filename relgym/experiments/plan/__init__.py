"""What planning is worth: courses of learning by planning in what was learned."""

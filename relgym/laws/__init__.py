"""Laws of motion in the frames that scenes offer: how things move freely, and what touching pairs do."""

"""First-order rules from examples: FOIL (Quinlan 1990), over integers and symbols only."""

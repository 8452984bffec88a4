"""What relgym is compared with: today's alternatives, all behind one interface (`relgym.baselines.base`)."""

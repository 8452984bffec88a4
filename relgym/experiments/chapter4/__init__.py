"""Chapter IV of the thesis as jobs: one per table and figure, each beside the numbers printed there."""

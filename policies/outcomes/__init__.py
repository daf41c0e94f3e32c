"""What a probe would tell the rivals apart by: reports of one predictor, weighed."""

"""What a detector says of pairs that show too little, or that contradict their calibration."""

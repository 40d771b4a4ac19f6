"""What a solved frame is worth: status, trust, doubts, intervals. Reads forces; never solves."""

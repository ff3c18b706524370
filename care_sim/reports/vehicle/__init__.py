"""What is shown of the vehicle study, beside the paper's figures (Sec. 5.5)."""

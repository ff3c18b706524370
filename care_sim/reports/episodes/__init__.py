"""One episode for people: its timeline, its clip, a picture of the brake."""

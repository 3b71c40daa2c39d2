"""Labelled data from scenes: cameras, lights and objects drawn at random, and what each pixel shows."""

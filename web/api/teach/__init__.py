"""Routes of teaching: frames and their annotation, trainings and networks."""

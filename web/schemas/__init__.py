"""Bodies of requests and answers, where they differ from the dataclasses of the interface."""

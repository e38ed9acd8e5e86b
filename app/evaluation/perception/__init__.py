"""Suites that judge what the robot sees: objects of the list, clicked and taught classes, light."""

"""Campaigns that try to break the project: runs that are killed, damaged files, strange maps."""

"""The workbench: a page on this machine to ask a city with, and what answers it."""

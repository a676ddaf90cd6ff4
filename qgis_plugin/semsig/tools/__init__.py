"""The tools of the provider: each module defines one or more algorithms."""

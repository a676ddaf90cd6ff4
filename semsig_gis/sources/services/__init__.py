"""Services that send open data, each by the protocol that it speaks."""

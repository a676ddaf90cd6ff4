"""HTTP requests with a cache, resumed downloads, retries and limits."""

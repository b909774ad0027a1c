"""The pages: server-rendered, the query string is the state, no request to any other host."""

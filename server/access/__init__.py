"""Who may do what: tokens, their scopes, and the middleware that asks for them."""

"""The common parts of the web servers: access, the TLS certificate, and the address to listen on."""

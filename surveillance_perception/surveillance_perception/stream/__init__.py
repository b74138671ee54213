"""Images from files, videos and webcams, and how to subscribe to them."""

"""Messages to people and programs about runs that have ended: what they say, and how they are delivered."""

"""The live page: the skin in 3-D, its panel, and the server of both."""

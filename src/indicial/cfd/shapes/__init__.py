"""cfd/shapes"""

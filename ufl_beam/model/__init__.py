"""What a user describes: beams, bodies, sections, laws, joints, supports, loads, scenes."""

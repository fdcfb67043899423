"""What is drawn over a picture: flat shapes and text, glowing marks, lines of matches, tubes of graphs."""

"""What a specimen went through: hours worth so many at another temperature, and thermal cycles."""

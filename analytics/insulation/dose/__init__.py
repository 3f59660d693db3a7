"""What a specimen went through: hours at one temperature by what they are worth at another, and thermal cycles."""

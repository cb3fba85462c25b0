
/* NOT BY ITSELF: some loops of this robot are closed by Newton's method, which is not in this file.
   sarrus closes them (sarrus serve --kernel, Robot::use_kernels, Plan::close of sarrus-dynamics), looks
   whether the state is one that the function is for, and puts these numbers behind the given ones. */

//! The faults in words, for the help of programs. Lines have at most 80 columns, so that a terminal does not wrap them.

/// The faults: how each is written, and what it does.
pub const FAULTS_HELP: &str = "\
\x20 3=missing                the servo of joint 3 has no power
  3=late, 3=late=MS        its answers are 30 ms late, or MS
  3=garbled, 3=garbled=N   each answer has a wrong checksum, or each Nth one
  3=stuck                  something keeps it from turning
  3=restarting=MS          it restarts each MS, and loses its torque
  2=wall=60                a wall at 60 degrees stops joint 2, from where the
                           joint is now
  2=wall=60/500            a soft one: it pushes back with 500 mN m for each
                           degree
  2=push=-300              a hand pushes joint 2 with 300 mN m, towards smaller
                           angles
  7=thing=30, 7=thing=30/100
                           a thing between the claws: they cannot close below
                           30 degrees of joint 7
  bus=echo                 the controller receives its own bytes
  supply=volts=V           the supply has V volts instead of 7.4; a servo
                           restarts below 4.5
  supply=dips=MS           each MS it falls to 3 V for 20 ms
  supply=off               the servos have no supply; the controller has its own
  flash=fails, flash=full  no settings can be stored
  line=loss=P%, line=corruption=P%, line=delay=MS
                           of the bytes on the host line
  arm=supported            no fault: a stand supports the arm, and it does not
                           fall
  arm=goal-starts-torque   in a servo that restarted, a goal switches torque on";

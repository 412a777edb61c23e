//! The second half of `host-sim --help`. Lines have at most 80 columns, so that a terminal does not wrap them again.

use arm_sim::faults::FAULTS_HELP;

/// Examples and explanations, after the options.
pub(crate) fn lesson() -> String {
    format!(
        "\
THE FIRST MINUTE
  host-sim --link ./7bot           an arm behind ./7bot, until Ctrl-C
  sevenbot --port ./7bot pose 120 90 65 90 90 90 80
  sevenbot --port ./7bot monitor   watch it move there
  sevenbot --port ./7bot stop      hold it where it is; `home` moves it back
  host-sim --link ./7bot --trace   the same, with every frame as text
  host-sim --eeprom none --fault 3=missing
                                   no stored settings, and joint 3 does not
                                   answer
  host-sim --arms 3 --link ./7bot  three arms, behind ./7bot-1, ./7bot-2 and
                                   ./7bot-3
  In the source tree: cargo sim -- --link ./7bot, and cargo sevenbot --
  --port ./7bot pose ...

  Any serial client can open the port, at any baud rate; with --strict-baud only
  at that of the arm. The first line on standard output is 'ready <tty path>',
  as soon as the port can be opened; with --arms there is one such line for each
  arm, in their order. Everything else is on standard error.

THE ARM HAS WEIGHT
  Without torque, a loaded joint falls, and in state damping it sinks. After
  power-up a hand holds each joint until it has torque. With --fault
  arm=supported it never falls.

WHILE IT RUNS
  sevenbot sim fault 3=missing --for 2s  faults, a hand, a weight, power: see
                                         sevenbot sim --help
  The control socket is for this user only. Standard error shows its path. With
  --arms each arm has its own socket, with its number before the extension.
  docs/simulation.md describes the requests.

LOCKSTEP
  host-sim --lockstep 1000 --link ./7bot  for a client that asks and waits for
                                          the answer
  Virtual time goes on only while a byte is on the host line. Then it stands
  until the client sends its next byte: the same client gets the same bytes in
  every run, however long it thinks. After MS without a byte, time goes on by 1
  ms. A client that sleeps, or that waits for reports, waits for this timeout.

FAULTS
{FAULTS_HELP}

MANY ARMS
  --arms N runs arms 1 to N in one process. If an option names a file, each arm
  has its own, with its number before the extension: --eeprom arm.bin keeps the
  settings of arm 2 in arm-2.bin. Chip ids are consecutive, starting with
  --chip-id. Faults and signals apply to all arms.

AN ARM OF THE MAKER
  host-sim --as-maker 2.1.4 --link ./7bot
                                   an arm as the maker ships it, to test a
                                   program against
  It has the maker's map 2.1, checks no value, says nothing of what it ignores,
  and has no status block. It sends text between its frames at start and with
  each alarm. Its settings are stored in 7bot/stock.bin.

REAL SERVOS
  host-sim --servos /dev/ttyUSB0 --link ./7bot
                                   the controller on this computer, real servos
                                   behind an adapter for bus servos; clients use
                                   ./7bot
  'ready' appears when the adapter's port is open. Standard error shows the
  servos that were found and statistics of the bus. If the adapter is unplugged,
  host-sim waits for it, and the arm holds. At the end the servos are damped, so
  that the arm sinks slowly; --hold-on-exit leaves them holding. Never connect a
  second controller to the same servos. An answer may arrive --usb-timeout later
  than on the wire. The default suits an adapter that collects bytes for 16 ms;
  goals do not wait for answers. With a shorter time, more questions are sent if
  a servo is missing. A time that is too short for the adapter loses answers. An
  FTDI adapter has a latency timer, 16 ms by default. host-sim sets it to 1 ms
  through its file in sysfs, which only root can write on most systems.
  ASYNC_LOW_LATENCY (setserial low_latency) is not set.

SERVOS ONLY
  host-sim --servos-only --link ./bus  seven servos, as behind a USB adapter
  host-sim --servos-only --link ./bus --usb-latency 1-20 --fault bus=echo
  The port carries raw frames of the servo bus. The servos receive bytes only at
  their own baud rate, --servo-baud, so set the port to it. --trace prints the
  bytes on the wire. A fault has the number of its joint, from 1 to 7, even if
  --ids gives the joint's servo another id.

SIGNALS
  SIGHUP           a power cycle: RAM registers are lost, settings and the port
                   stay
  SIGUSR1          with --servos-only: unplugs the adapter, and plugs it in
                   again. The servos keep their power. Without the adapter, the
                   port and its link do not exist
  SIGUSR2          a restart of the controller only: the servos keep power,
                   torque and goals
  SIGINT, SIGTERM  the end

EXIT STATUS
  0   ended by a signal, or after --help, --version or an equal replay
  1   the operating system failed while the simulator ran, or a replay differs
  2   an option or a file cannot be used; standard error says why, in one line"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_help_fits_a_terminal_of_80_columns() {
        for line in lesson().lines() {
            assert!(line.chars().count() <= 80, "{line}");
        }
    }
}

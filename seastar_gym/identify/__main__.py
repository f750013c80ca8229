import sys

from seastar_gym.identify.identify import main

sys.exit(main())
